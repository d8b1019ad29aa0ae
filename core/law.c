// law: see law.h
