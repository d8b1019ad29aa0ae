file(REMOVE_RECURSE
  "CMakeFiles/test_server_receiver.dir/server/test_receiver.c.o"
  "CMakeFiles/test_server_receiver.dir/server/test_receiver.c.o.d"
  "test_server_receiver"
  "test_server_receiver.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_server_receiver.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
