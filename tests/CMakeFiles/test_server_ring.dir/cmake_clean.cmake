file(REMOVE_RECURSE
  "CMakeFiles/test_server_ring.dir/server/test_ring.c.o"
  "CMakeFiles/test_server_ring.dir/server/test_ring.c.o.d"
  "test_server_ring"
  "test_server_ring.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_server_ring.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
