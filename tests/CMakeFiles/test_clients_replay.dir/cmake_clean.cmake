file(REMOVE_RECURSE
  "CMakeFiles/test_clients_replay.dir/clients/test_replay.c.o"
  "CMakeFiles/test_clients_replay.dir/clients/test_replay.c.o.d"
  "test_clients_replay"
  "test_clients_replay.pdb"
)

# Per-language clean rules from dependency scanning.
foreach(lang C)
  include(CMakeFiles/test_clients_replay.dir/cmake_clean_${lang}.cmake OPTIONAL)
endforeach()
