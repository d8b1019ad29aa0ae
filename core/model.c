// model: see model.h
