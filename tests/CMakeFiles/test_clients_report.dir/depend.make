# Empty dependencies file for test_clients_report.
# This may be replaced when dependencies are built.
