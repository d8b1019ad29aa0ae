# Empty compiler generated dependencies file for test_core_state.
# This may be replaced when dependencies are built.
