"""Hypothesis strategies of damaged inputs: the mutations of `validation.fuzz`, drawn and shrunk by hypothesis."""

from functools import partial

from hypothesis import strategies as st

from validation.fuzz import files, foreign, logs, results

RANDOM = st.randoms(use_true_random=False)
"""Random numbers of a mutation or of the choice of a use."""


def of(mutation, *arguments):
    return RANDOM.map(lambda rng: mutation(rng, *arguments))


def damaged_logs():
    return of(logs.damaged_log)


def altered_logs():
    return of(logs.altered_log)


def foreign_files():
    """Name, bytes and mapping of a file of any format."""
    each = [
        of(foreign.damaged_file, name).map(partial(lambda file, pair: (file, *pair), file))
        for name, (file, _) in foreign.FORMATS.items()
    ]
    return st.one_of(each)


def campaigns():
    return of(lambda rng: files.damaged_toml(rng, files.campaigns()))


def mappings():
    return of(lambda rng: files.damaged_toml(rng, files.mappings()))


def aircraft_files():
    return of(lambda rng: files.damaged_toml(rng, files.aircraft()))


def traces():
    return of(lambda rng: results.damaged_json(rng, results.trace()))


def loops():
    return of(lambda rng: results.damaged_json(rng, results.closed_loop()))


def estimates():
    return of(results.damaged_table, "estimates.parquet")
