# Empty compiler generated dependencies file for test_core_law.
# This may be replaced when dependencies are built.
