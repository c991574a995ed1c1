#include "job.h"

#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "http.h"
#include "problem.h"
#include "terminal.h"
#include "text.h"

enum { POLL_MICROSECONDS = 120 * 1000 };

/* Fetches the job again: on a terminal soon, to draw its progress; else when it ends or after 20 s. */
static int poll(cli *c, const char *url, cli_reply *reply) {
  char *path = cli_text("%s%s", url, c->bar ? "" : "?wait=20");
  cli_request request = {.method = "GET", .path = path, .patient = 1};
  if (c->bar) {
    usleep(POLL_MICROSECONDS);
  }
  int rc = cli_send(c, &request, reply);
  free(path);
  return rc;
}

static int ended(const char *state) {
  return !strcmp(state, "succeeded") || !strcmp(state, "failed") || !strcmp(state, "cancelled");
}

static int conclude(cli *c, const cJSON *job, char **result) {
  const char *state = cli_string(job, "state", "");
  const cJSON *problem = cJSON_GetObjectItemCaseSensitive(job, "problem");
  cli_bar_end(c);
  if (!strcmp(state, "succeeded")) {
    *result = cli_text("%s", cli_string(job, "result", ""));
    return CLI_DONE;
  }
  if (cJSON_IsObject(problem)) {
    return cli_problem(c, NULL, problem);
  }
  cli_error(c, "job %s: %s", cli_string(job, "id", "?"), state);
  return CLI_REFUSED;
}

/* Printed when the user interrupts the wait. Formatted beforehand: a signal handler must not call printf. */
static char farewell[256];

static void on_interrupt(int signal_number) {
  if (write(STDERR_FILENO, farewell, strlen(farewell)) >= 0) {
    signal(signal_number, SIG_DFL);
  }
  raise(signal_number);
}

static void prepare_farewell(const cli *c, const char *url) {
  snprintf(farewell, sizeof farewell,
           "%sorbmorph: the job keeps running. To wait for it: orbmorph job --wait %s\n"
           "Repeating the command also waits for it. To cancel it: orbmorph job --cancel %s\n",
           c->bar ? "\r\033[K" : "", url, url);
  struct sigaction action = {.sa_handler = on_interrupt, .sa_flags = SA_NODEFER};
  sigaction(SIGINT, &action, NULL);
}

/* "align, 12 s left": the label has room for the longest stage and 9,999 seconds. */
static void show_bar(cli *c, const cJSON *job, const char *step) {
  const double left = cli_number(job, "seconds_left");
  char label[32];
  if (left > 0 && left < 1e4) {
    snprintf(label, sizeof label, "%.10s, %.0f s left", step, left);
  } else {
    snprintf(label, sizeof label, "%.24s", step);
  }
  cli_bar(c, label, cli_number(job, "progress"));
}

int cli_wait(cli *c, const cJSON *job, char **result) {
  char *url = cli_text("%s", cli_string(job, "url", ""));
  cli_reply reply = {0};
  int rc = CLI_DONE;
  *result = NULL;
  prepare_farewell(c, url);
  while (!ended(cli_string(job, "state", ""))) {
    cli_reply next;
    const char *stage = cli_string(job, "stage", cli_string(job, "state", ""));
    show_bar(c, job, *stage ? stage : cli_string(job, "state", ""));
    if ((rc = poll(c, url, &next)) != CLI_DONE) {
      cli_error(c, "the job continues when the daemon is back. To wait for it: orbmorph job --wait %s", url);
      cli_reply_free(&next);
      break;
    }
    cli_reply_free(&reply);
    reply = next;
    if (!cli_ok(&reply) || !reply.json) {
      rc = cli_refused(c, url, &reply);
      break;
    }
    job = reply.json;
  }
  signal(SIGINT, SIG_DFL);
  if (rc == CLI_DONE) {
    rc = conclude(c, job, result);
  }
  cli_reply_free(&reply);
  free(url);
  return rc;
}
