/* The kinds of commands; each is a file of this folder. */
#ifndef ORB_ADMIN_KINDS_H
#define ORB_ADMIN_KINDS_H

#include "admin/command.h"

extern const admin_kind admin_crash, admin_key, admin_token, admin_webhook;

#endif
