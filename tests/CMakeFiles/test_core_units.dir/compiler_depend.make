# Empty compiler generated dependencies file for test_core_units.
# This may be replaced when dependencies are built.
