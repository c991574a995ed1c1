/* What every file of the program orbmorph shares: its version and its exit statuses. */
#ifndef ORB_CLI_PROGRAM_H
#define ORB_CLI_PROGRAM_H

#define CLI_VERSION "1.0.0"
#define CLI_DEFAULT_SERVER "http://127.0.0.1:8080"

enum { CLI_DONE = 0, CLI_REFUSED = 1, CLI_USAGE = 2, CLI_UNREACHABLE = 3 };

#endif
