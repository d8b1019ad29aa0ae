# Empty dependencies file for test_server_servo.
# This may be replaced when dependencies are built.
