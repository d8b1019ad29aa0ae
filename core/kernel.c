// kernel: see kernel.h
