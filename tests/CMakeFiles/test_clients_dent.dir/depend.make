# Empty dependencies file for test_clients_dent.
# This may be replaced when dependencies are built.
