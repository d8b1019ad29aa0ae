# Empty dependencies file for test_server_sentinel.
# This may be replaced when dependencies are built.
