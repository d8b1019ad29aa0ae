# Empty compiler generated dependencies file for test_clients_path.
# This may be replaced when dependencies are built.
