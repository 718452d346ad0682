"""What holds for all tests: none of them fails by the clock."""

from hypothesis import settings

# On a loaded machine a quick example may take a second.
settings.register_profile("no clock", deadline=None)
settings.load_profile("no clock")
