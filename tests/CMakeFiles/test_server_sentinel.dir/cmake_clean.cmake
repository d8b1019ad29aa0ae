file(REMOVE_RECURSE
  "CMakeFiles/test_server_sentinel.dir/server/test_sentinel.c.o"
  "CMakeFiles/test_server_sentinel.dir/server/test_sentinel.c.o.d"
  "test_server_sentinel"
  "test_server_sentinel.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_server_sentinel.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
