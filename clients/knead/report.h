#include "clients/knead/session_record.h"
