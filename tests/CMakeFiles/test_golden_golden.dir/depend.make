# Empty dependencies file for test_golden_golden.
# This may be replaced when dependencies are built.
