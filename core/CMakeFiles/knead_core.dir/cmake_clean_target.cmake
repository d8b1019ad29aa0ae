file(REMOVE_RECURSE
  "libknead.a"
)
