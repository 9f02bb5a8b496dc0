"""Small examples that are installed with the package: PDDL domains and problems with parametrized STN plans."""
