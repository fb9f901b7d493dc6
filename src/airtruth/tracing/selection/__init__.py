"""Score tests, omnibus tests, acceptance rules and the search over effects."""
