# CMake generated Testfile for 
# Source directory: /tmp/wt/scripts
# Build directory: /tmp/wt/scripts
# 
# This file includes the relevant testing commands required for 
# testing this directory and lists subdirectories to be tested as well.
subdirs("core")
subdirs("proto")
subdirs("server")
subdirs("clients")
subdirs("tests")
subdirs("bench")
