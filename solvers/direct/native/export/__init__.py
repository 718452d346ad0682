"""A loop or a solver as C that needs no Python: ``export_c``."""
