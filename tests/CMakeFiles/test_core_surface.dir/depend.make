# Empty dependencies file for test_core_surface.
# This may be replaced when dependencies are built.
