/* studio: starts a daemon and opens its studio in the browser. */
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "commands.h"
#include "http.h"
#include "mesh.h"
#include "terminal.h"
#include "text.h"

/* The data folder that --data names, or the user's own. Creates its parents; the daemon creates the folder. */
static char *data_folder(const cli *c) {
  const char *given = c->args.value[OPT_DATA], *base = getenv("XDG_DATA_HOME"), *home = getenv("HOME");
  if (given) {
    return cli_text("%s", given);
  }
  char *folder = base && *base ? cli_text("%s/orbmorph", base)
                               : cli_text("%s/.local/share/orbmorph", home && *home ? home : "/tmp");
  for (char *slash = strchr(folder + 1, '/'); slash; slash = strchr(slash + 1, '/')) {
    *slash = 0;
    mkdir(folder, 0700);
    *slash = '/';
  }
  return folder;
}

/* The daemon beside this program; else the one in PATH. */
static char *daemon_program(void) {
  char self[PATH_MAX];
  ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
  if (length > 0) {
    self[length] = 0;
    char *slash = strrchr(self, '/'), *beside = cli_text("%.*s/orbmorphd", (int)(slash ? slash - self : 0), self);
    if (access(beside, X_OK) == 0) {
      return beside;
    }
    free(beside);
  }
  return cli_text("orbmorphd");
}

static volatile sig_atomic_t ending;

static void on_end(int number) {
  ending = number;
}

/* Starts the daemon on a free port; the terminal shows its errors only, for people to read. *out: its standard output.
 * −1 if it cannot be started. */
static pid_t start(const char *data, FILE **out) {
  int ends[2];
  char *program = daemon_program();
  if (pipe(ends) != 0) {
    free(program);
    return -1;
  }
  pid_t child = fork();
  if (child == 0) {
    dup2(ends[1], STDOUT_FILENO);
    close(ends[0]);
    close(ends[1]);
    execlp(program, program, "--listen", "127.0.0.1:0", "--data", data, "--log-level", "error", "--log-format", "text",
           (char *)NULL);
    fprintf(stderr, "orbmorph: cannot start %s: %s\n", program, strerror(errno));
    _exit(127);
  }
  close(ends[1]);
  *out = child > 0 ? fdopen(ends[0], "r") : NULL;
  free(program);
  return child;
}

/* The address from the line that the daemon prints when it is ready; NULL if it ends without that line. */
static char *address_of(FILE *out) {
  static const char ready[] = "orbmorphd listening on ";
  char line[512];
  while (fgets(line, sizeof line, out)) {
    if (!strncmp(line, ready, sizeof ready - 1)) {
      line[strcspn(line, "\n")] = 0;
      return cli_text("%s", line + sizeof ready - 1);
    }
  }
  return NULL;
}

/* Uploads the files and returns the fragment that opens them in the studio. */
static int upload_all(cli *c, char **fragment) {
  *fragment = cli_text("%s", "");
  for (int i = 0; i < c->args.operand_count; i++) {
    cli_mesh mesh;
    int rc = cli_mesh_of(c, i, &mesh);
    if (rc == CLI_REFUSED) {
      cli_note(c,
               "The studio shows what is wrong with a mesh, and offers repairs: start it without this file, and drop "
               "the file on its page.");
    }
    if (rc != CLI_DONE) {
      return rc;
    }
    char *longer = cli_text("%s%s%s", *fragment, i ? "," : "#m=", mesh.id);
    free(*fragment);
    *fragment = longer;
    cli_mesh_free(&mesh);
  }
  return CLI_DONE;
}

/* Opens a page with $BROWSER, or with what the desktop opens pages with. Says so if there is no such program. */
static void open_browser(const cli *c, const char *url) {
  const char *browser = getenv("BROWSER");
  const char *const programs[] = {browser && *browser ? browser : "xdg-open", "open", "wslview"};
  pid_t child = fork();
  if (child == 0) {
    int terminal = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3), nothing = open("/dev/null", O_RDWR);
    for (int fd = 0; nothing >= 0 && fd < 3; fd++) {
      dup2(nothing, fd);
    }
    setsid();
    for (size_t i = 0; i < sizeof programs / sizeof programs[0]; i++) {
      execlp(programs[i], programs[i], url, (char *)NULL);
    }
    dup2(terminal, STDERR_FILENO);
    cli_note(c, "No program to open a browser was found: open the address above yourself.");
    _exit(127);
  }
}

static int serve(cli *c, pid_t daemon, char *address) {
  char *fragment = NULL;
  c->server = address;
  int rc = upload_all(c, &fragment);
  if (rc == CLI_DONE) {
    char *url = cli_text("%s/%s", address, fragment);
    printf("%s\n", url);
    fflush(stdout);
    cli_note(c, "The studio runs until you press Ctrl-C.");
    if (!c->args.value[OPT_NO_OPEN]) {
      open_browser(c, url);
    }
    free(url);
    while (!ending) {
      int status;
      if (waitpid(daemon, &status, 0) == daemon) {
        free(fragment);
        return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? CLI_DONE : CLI_UNREACHABLE;
      }
    }
  }
  free(fragment);
  kill(daemon, SIGTERM);
  while (waitpid(daemon, NULL, 0) < 0 && errno == EINTR) {
  }
  return rc;
}

int cli_run_studio(cli *c) {
  int rc = cli_check_meshes(c);
  if (rc != CLI_DONE) {
    return rc;
  }
  FILE *out = NULL;
  struct sigaction action = {.sa_handler = on_end}; /* interrupts waitpid() */
  sigaction(SIGTERM, &action, NULL);
  sigaction(SIGINT, &action, NULL);
  sigaction(SIGHUP, &action, NULL);
  char *data = data_folder(c);
  pid_t daemon = start(data, &out);
  char *address = out ? address_of(out) : NULL;
  rc = CLI_UNREACHABLE;
  if (address) {
    rc = serve(c, daemon, address);
  } else {
    cli_error(c, "the daemon did not start; its message is above (data folder: %s)", data);
    if (daemon > 0) {
      kill(daemon, SIGTERM);
      waitpid(daemon, NULL, 0);
    }
  }
  if (out) {
    fclose(out);
  }
  free(address);
  free(data);
  return rc;
}
