"""The native solver: an interior point over stages, in C that is generated for one problem."""
