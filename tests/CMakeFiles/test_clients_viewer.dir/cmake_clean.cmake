file(REMOVE_RECURSE
  "CMakeFiles/test_clients_viewer.dir/clients/test_viewer.c.o"
  "CMakeFiles/test_clients_viewer.dir/clients/test_viewer.c.o.d"
  "test_clients_viewer"
  "test_clients_viewer.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_clients_viewer.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
