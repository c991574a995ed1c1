/* Runs a program as if the kernel lacked landlock or seccomp filters, or as if a unit denied all addresses.
 *   without landlock|seccomp|addresses PROGRAM [ARGUMENT…] */
#include <errno.h>
#include <seccomp.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <unistd.h>

int main(int count, char **arguments) {
  int landlock = count > 2 && strcmp(arguments[1], "landlock") == 0;
  int addresses = count > 2 && strcmp(arguments[1], "addresses") == 0;
  if (!landlock && !addresses && (count <= 2 || strcmp(arguments[1], "seccomp") != 0)) {
    fprintf(stderr, "usage: without landlock|seccomp|addresses PROGRAM [ARGUMENT…]\n");
    return 2;
  }
  scmp_filter_ctx rules = seccomp_init(SCMP_ACT_ALLOW);
  int failed = !rules;
  if (landlock) {
    failed = failed || seccomp_rule_add(rules, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(landlock_create_ruleset), 0) != 0;
  } else if (addresses) {
    failed = failed || seccomp_rule_add(rules, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(connect), 0) != 0;
  } else {
    failed = failed || seccomp_rule_add(rules, SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(seccomp), 0) != 0 ||
             seccomp_rule_add(rules, SCMP_ACT_ERRNO(EINVAL), SCMP_SYS(prctl), 1,
                              SCMP_A0(SCMP_CMP_EQ, PR_SET_SECCOMP, 0)) != 0;
  }
  if (failed || seccomp_load(rules) != 0) {
    perror("without");
    return 2;
  }
  execv(arguments[2], arguments + 2);
  perror(arguments[2]);
  return 2;
}
