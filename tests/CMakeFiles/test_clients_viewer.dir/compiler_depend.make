# Empty compiler generated dependencies file for test_clients_viewer.
# This may be replaced when dependencies are built.
