# Empty compiler generated dependencies file for test_rt_trap.
# This may be replaced when dependencies are built.
