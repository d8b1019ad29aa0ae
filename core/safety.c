// safety: see safety.h
