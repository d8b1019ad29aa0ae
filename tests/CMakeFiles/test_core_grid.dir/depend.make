# Empty dependencies file for test_core_grid.
# This may be replaced when dependencies are built.
