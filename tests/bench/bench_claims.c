/* Measures how long nodes take to claim a job while a million wait in PostgreSQL (docs/cluster.md, "Capacity").
 *
 *   tests/tools/with_postgresql.sh build/bin/claims-bench [JOBS [OWNERS [CLAIMS]]]    (1000000 100 1000)
 *
 * Fills an empty catalogue, then claims, and ends each claimed job, so that the queue stays as long. Prints percentiles
 * of what nodes ask of the database, in milliseconds. The server of with_postgresql.sh does not wait for its disk
 * (fsync=off). Exit status 1: the 99th percentile of a claim is above 10 ms. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "store/notices.h"
#include "store/shared.h"
#include "store/transactions.h"

static const double GOAL_MS = 10;
static const char node[] = "11111111111111111111111111111111", other_node[] = "22222222222222222222222222222222";

typedef struct series {
  const char *what;
  double *ms;
  int count;
} series;

static double now_ms(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return 1e3 * (double)now.tv_sec + 1e-6 * (double)now.tv_nsec;
}

static int by_value(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static double report(series *s) {
  qsort(s->ms, (size_t)s->count, sizeof *s->ms, by_value);
  double p99 = s->ms[(s->count - 1) * 99 / 100];
  printf("| %s | %.2f | %.2f | %.2f |\n", s->what, s->ms[s->count / 2], p99, s->ms[s->count - 1]);
  fflush(stdout);
  return p99;
}

static void must(int fine, const char *what) {
  if (!fine) {
    fprintf(stderr, "claims-bench: %s\n", what);
    exit(2);
  }
}

typedef struct filling {
  long jobs, owners;
} filling;

/* Triggers would count a million rows one by one; the sums are the same. One job in three is a download: claims of one
 * kind pass over those of the other. */
static int fill(database *db, void *argument) {
  const filling *f = argument;
  char sql[2048];
  snprintf(
      sql, sizeof sql,
      "SET LOCAL statement_timeout=0; ALTER TABLE job DISABLE TRIGGER USER;"
      "INSERT INTO job(id, key, kind, state, attempt, listed, priority, cost, owner, request, created)"
      " SELECT md5('i' || i), md5('k' || i) || md5('l' || i), CASE WHEN i %% 3=0 THEN 2 ELSE 0 END, 0, 0, 1, 3 + i %% "
      "3,"
      "  100 + (i::bigint * 7919) %% 100000, 'owner' || i %% %ld, '{\"mesh\":\"' || md5('m' || i) || '\"}', i"
      " FROM generate_series(1, %ld) AS i;"
      "INSERT INTO turn(owner, ready, unfinished, listed, computing, cost) SELECT owner, count(*), count(*), count(*),"
      " count(*) FILTER (WHERE kind<>2), coalesce(sum(cost) FILTER (WHERE kind<>2), 0) FROM job GROUP BY owner;"
      "ALTER TABLE job ENABLE TRIGGER USER",
      f->owners, f->jobs);
  return database_execute(db, sql);
}

static void end(catalogue *cat, const job_claim *c) {
  const job_end how = {.state = API_JOB_FAILED,
                       .problem = "{}",
                       .now = 5,
                       .event = c->last_event + 1,
                       .event_json = "{}",
                       .owner = c->row.owner,
                       .worker_ms = 100};
  must(catalogue_job_finish(cat, c->row.id, c->row.attempt, &how) == STORE_OK, "a job cannot be ended");
}

/* Claims of one kind of worker; expects: whether jobs for it exist. */
static double measure_claims(catalogue *cat, const char *what, const claim_wish *wish, int count, int expects) {
  series s = {.what = what, .ms = calloc((size_t)count, sizeof(double))};
  must(s.ms != NULL, "out of memory");
  while (s.count < count) {
    job_claim c;
    double began = now_ms();
    store_result result = catalogue_claim_next(cat, wish, &c);
    s.ms[s.count++] = now_ms() - began;
    must(result == (expects ? STORE_OK : STORE_NOT_FOUND), "a claim did not end as expected");
    if (expects) {
      end(cat, &c);
      job_row_free(&c.row);
    }
  }
  double p99 = report(&s);
  free(s.ms);
  return p99;
}

static void measure_numbers(catalogue *cat, int count) {
  series s = {.what = "numbers for autoscaling", .ms = calloc((size_t)count, sizeof(double))};
  must(s.ms != NULL, "out of memory");
  while (s.count < count) {
    shared_numbers numbers;
    double began = now_ms();
    must(catalogue_shared_numbers(cat, &numbers) == STORE_OK, "the numbers cannot be read");
    s.ms[s.count++] = now_ms() - began;
  }
  report(&s);
  free(s.ms);
}

static void measure_submits(catalogue *cat, int count) {
  series s = {.what = "accepting a job", .ms = calloc((size_t)count, sizeof(double))};
  char request[] = "{}";
  must(s.ms != NULL, "out of memory");
  while (s.count < count) {
    job_row row = {.kind = API_JOB_EMBEDDING, .listed = 1, .cost = 1000, .created = 1, .request = request};
    job_submission submission = {.row = &row, .limit = INT64_MAX};
    api_random_id(row.id);
    snprintf(row.key, sizeof row.key, "%s%s", row.id, row.id);
    snprintf(row.owner, sizeof row.owner, "owner1");
    double began = now_ms();
    must(catalogue_job_submit(cat, &submission) == STORE_OK && submission.outcome == SUBMIT_FRESH,
         "a job is not accepted");
    s.ms[s.count++] = now_ms() - began;
  }
  report(&s);
  free(s.ms);
}

static int vacuum(const char *url) {
  database db;
  int code = database_open(url, SQL_WRITES, &db);
  code = code == SQL_OK ? database_execute(&db, "SET statement_timeout=0") : code;
  code = code == SQL_OK ? database_execute(&db, "VACUUM ANALYZE job") : code;
  code = code == SQL_OK ? database_execute(&db, "VACUUM ANALYZE turn") : code;
  database_close(&db);
  return code == SQL_OK;
}

int main(int count, char **words) {
  const filling f = {.jobs = count > 1 ? atol(words[1]) : 1000000, .owners = count > 2 ? atol(words[2]) : 100};
  const int claims = count > 3 ? atoi(words[3]) : 1000;
  char command[256], url[256] = "";
  catalogue *cat = NULL;
  int fresh;
  snprintf(command, sizeof command, "%s claims-%d", getenv("ORB_NEW_CATALOGUE"), (int)getpid());
  FILE *out = getenv("ORB_NEW_CATALOGUE") ? popen(command, "r") : NULL;
  must(out && fgets(url, sizeof url, out) && pclose(out) == 0, "to be run by tests/tools/with_postgresql.sh");
  must(f.jobs > 0 && f.owners > 0 && claims > 0, "JOBS, OWNERS and CLAIMS are numbers");
  must(catalogue_open_shared(url, 1, &cat) == STORE_OK, "no catalogue");
  double began = now_ms();
  must(catalogue_write(cat, fill, (void *)(uintptr_t)&f) == STORE_OK, "the catalogue cannot be filled");
  catalogue_close(cat);
  must(vacuum(url), "VACUUM failed");
  printf("%ld jobs of %ld owners, filled in %.0f s\n\n| | median ms | 99 %% | most |\n|---|---|---|---|\n", f.jobs,
         f.owners, 1e-3 * (now_ms() - began));
  notices *bell = notices_open(url);
  must(catalogue_open_shared(url, 1, &cat) == STORE_OK && bell && notices_connect(bell, &fresh) &&
           notices_renew(bell, node, 4, 3600000) && notices_renew(bell, other_node, 4, 3600000),
       "no node");
  claim_wish wish = {.node = node, .most_cost = INT64_MAX, .big = 1, .alone = 1, .alone_ms = 60000, .fetches_most = 4};
  double worst = measure_claims(cat, "claim by an idle node", &wish, claims, 1);
  wish.alone = 0; /* it looks for suspects, for which a node keeps its workers */
  double p99 = measure_claims(cat, "claim by a node that runs a job", &wish, claims, 1);
  worst = p99 > worst ? p99 : worst;
  wish.fetches = 1;
  p99 = measure_claims(cat, "claim of a download", &wish, claims, 1);
  worst = p99 > worst ? p99 : worst;
  wish.fetches = 0;
  wish.most_cost = 99;
  p99 = measure_claims(cat, "claim without memory for any job", &wish, claims, 0);
  worst = p99 > worst ? p99 : worst;
  measure_submits(cat, claims);
  measure_numbers(cat, claims);
  notices_close(bell);
  catalogue_close(cat);
  return worst > GOAL_MS;
}
