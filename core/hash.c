// hash: see hash.h
