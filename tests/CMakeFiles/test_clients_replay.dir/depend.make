# Empty dependencies file for test_clients_replay.
# This may be replaced when dependencies are built.
