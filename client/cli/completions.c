/* Completions for shells, made of the lists of commands and options. */
#include <string.h>

#include "cli.h"

/* What a command takes besides options, where that is a fixed list. */
static const char *operand_words(const cli_command *command) {
  return !strcmp(command->name, "ls")            ? "meshes embeddings supermeshes jobs"
         : !strcmp(command->name, "completions") ? "bash zsh fish"
                                                 : NULL;
}

static void bash_command(const cli_command *command) {
  const char *operands = operand_words(command);
  printf("    %s)\n      words=\"", command->name);
  for (int id = 0; id < OPT_COUNT; id++)
    if (command->options & CLI_BIT(id))
      printf("--%s ", cli_options[id].name);
  printf("\"\n");
  if (operands)
    printf("      operands=\"%s\"\n", operands);
  puts("      ;;");
}

static void bash(void) {
  puts(
      "# Completions of orbmorph for bash. Made by 'orbmorph completions bash'.\n"
      "_orbmorph() {\n"
      "  local current=\"${COMP_WORDS[COMP_CWORD]}\" previous=\"${COMP_WORDS[COMP_CWORD-1]}\" words=\"\" operands=\"\" "
      "choices=\"\"");
  fputs("  if [ \"$COMP_CWORD\" -eq 1 ]; then\n    COMPREPLY=($(compgen -W \"", stdout);
  for (int i = 0; i < cli_command_count; i++)
    printf("%s ", cli_commands[i].name);
  puts("--help --version\" -- \"$current\"))\n    return\n  fi\n  case \"$previous\" in");
  for (int id = 0; id < OPT_COUNT; id++)
    if (cli_options[id].choices)
      printf("    --%s) choices=\"%s\" ;;\n", cli_options[id].name, cli_options[id].choices);
  puts(
      "  esac\n"
      "  if [ -n \"$choices\" ]; then\n    COMPREPLY=($(compgen -W \"$choices\" -- \"$current\"))\n    return\n  fi\n"
      "  case \"${COMP_WORDS[1]}\" in");
  for (int i = 0; i < cli_command_count; i++)
    bash_command(&cli_commands[i]);
  puts(
      "  esac\n"
      "  case \"$current\" in\n"
      "    -*) COMPREPLY=($(compgen -W \"$words\" -- \"$current\")) ;;\n"
      "    *) COMPREPLY=($(compgen -W \"$operands\" -- \"$current\")) ;;\n"
      "  esac\n"
      "}\n"
      "complete -o bashdefault -o default -F _orbmorph orbmorph");
}

/* Text within single quotes and brackets of _arguments. */
static void zsh_text(const char *text) {
  for (; *text; text++) {
    if (*text == '\'')
      fputs("'\\''", stdout);
    else if (strchr("[]:", *text))
      printf("\\%c", *text);
    else
      putchar(*text);
  }
}

static void zsh_command(const cli_command *command) {
  printf("    %s)\n      _arguments -s", command->name);
  for (int id = 0; id < OPT_COUNT; id++) {
    const cli_option *o = &cli_options[id];
    if (!(command->options & CLI_BIT(id)))
      continue;
    printf(" \\\n        '%s--%s[", id == OPT_SET ? "*" : "", o->name);
    zsh_text(o->help);
    putchar(']');
    if (o->choices)
      printf(":%s:(%s)", o->value, o->choices);
    else if (o->value)
      printf(":%s:%s", o->value, strcmp(o->value, "FILE") ? "" : "_files");
    putchar('\'');
  }
  if (operand_words(command))
    printf(" \\\n        '1:what:(%s)'", operand_words(command));
  else
    fputs(" \\\n        '*:file:_files'", stdout);
  puts(" ;;");
}

static void zsh(void) {
  puts(
      "#compdef orbmorph\n# Completions of orbmorph for zsh. Made by 'orbmorph completions zsh'.\n"
      "_orbmorph() {\n  local -a commands\n  commands=(");
  for (int i = 0; i < cli_command_count; i++) {
    printf("    '%s:", cli_commands[i].name);
    zsh_text(cli_commands[i].summary);
    puts("'");
  }
  puts(
      "  )\n  if (( CURRENT == 2 )); then\n    _describe command commands\n    return\n  fi\n"
      "  local command=$words[2]\n  shift words\n  (( CURRENT-- ))\n  case $command in");
  for (int i = 0; i < cli_command_count; i++)
    zsh_command(&cli_commands[i]);
  puts("  esac\n}\n_orbmorph \"$@\"");
}

/* Text within single quotes of fish. */
static void fish_text(const char *text) {
  for (; *text; text++) {
    if (*text == '\'' || *text == '\\')
      putchar('\\');
    putchar(*text);
  }
}

static void fish_command(const cli_command *command) {
  printf("complete -c orbmorph -n __fish_use_subcommand -f -a %s -d '", command->name);
  fish_text(command->summary);
  puts("'");
  if (operand_words(command))
    printf("complete -c orbmorph -n '__fish_seen_subcommand_from %s' -f -a '%s'\n", command->name,
           operand_words(command));
  for (int id = 0; id < OPT_COUNT; id++) {
    const cli_option *o = &cli_options[id];
    if (!(command->options & CLI_BIT(id)))
      continue;
    printf("complete -c orbmorph -n '__fish_seen_subcommand_from %s' -l %s", command->name, o->name);
    if (o->letter)
      printf(" -s %c", o->letter);
    if (o->choices)
      printf(" -x -a '%s'", o->choices);
    else if (o->value)
      fputs(" -r", stdout);
    fputs(" -d '", stdout);
    fish_text(o->help);
    puts("'");
  }
}

static void fish(void) {
  puts("# Completions of orbmorph for fish. Made by 'orbmorph completions fish'.");
  puts("complete -c orbmorph -n __fish_use_subcommand -l help -d 'this help'");
  puts("complete -c orbmorph -n __fish_use_subcommand -l version -d 'the version'");
  for (int i = 0; i < cli_command_count; i++)
    fish_command(&cli_commands[i]);
}

int cli_run_completions(cli *c) {
  static const struct {
    const char *name;
    void (*print)(void);
  } shells[] = {{"bash", bash}, {"zsh", zsh}, {"fish", fish}};
  for (size_t i = 0; i < sizeof shells / sizeof shells[0]; i++)
    if (!strcmp(c->args.operands[0], shells[i].name)) {
      shells[i].print();
      return CLI_DONE;
    }
  cli_error(c, "there are completions for bash, zsh and fish, but not for '%s'", c->args.operands[0]);
  return CLI_USAGE;
}
