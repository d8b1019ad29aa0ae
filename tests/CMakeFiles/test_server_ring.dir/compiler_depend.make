# Empty compiler generated dependencies file for test_server_ring.
# This may be replaced when dependencies are built.
