file(REMOVE_RECURSE
  "libknead_server.a"
)
