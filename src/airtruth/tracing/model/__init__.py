"""The declared aircraft as a nonlinear filter: plant, records, parameters, equations and response."""
