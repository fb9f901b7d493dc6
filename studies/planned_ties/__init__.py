"""Study of planned flights on the ties that blind trials leave; see `studies.planned_ties.study`."""
