# Empty compiler generated dependencies file for test_core_safety.
# This may be replaced when dependencies are built.
