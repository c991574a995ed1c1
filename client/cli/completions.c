/* Completions for shells, made from the tables of commands and options. */
#include <string.h>

#include "commands.h"
#include "terminal.h"

static void bash_command(const cli_command *command) {
  printf("    %s)\n      words=\"", command->name);
  for (int id = 0; id < OPT_COUNT; id++) {
    if (command->options & CLI_BIT(id)) {
      printf("--%s ", cli_options[id].name);
    }
  }
  printf("\"\n");
  if (command->words) {
    printf("      operands=\"%s\"\n", command->words);
  }
  puts("      ;;");
}

static void bash(const cli_commands *commands) {
  puts(
      "# Completions of orbmorph for bash, printed by 'orbmorph completions bash'.\n"
      "_orbmorph() {\n"
      "  local current=\"${COMP_WORDS[COMP_CWORD]}\" previous=\"${COMP_WORDS[COMP_CWORD-1]}\" words=\"\" operands=\"\" "
      "choices=\"\"");
  fputs("  if [ \"$COMP_CWORD\" -eq 1 ]; then\n    COMPREPLY=($(compgen -W \"", stdout);
  for (int i = 0; i < commands->count; i++) {
    printf("%s ", commands->list[i].name);
  }
  puts("--help --version\" -- \"$current\"))\n    return\n  fi\n  case \"$previous\" in");
  for (int id = 0; id < OPT_COUNT; id++) {
    if (cli_options[id].choices) {
      printf("    --%s) choices=\"%s\" ;;\n", cli_options[id].name, cli_options[id].choices);
    }
  }
  puts(
      "  esac\n"
      "  if [ -n \"$choices\" ]; then\n    COMPREPLY=($(compgen -W \"$choices\" -- \"$current\"))\n    return\n  fi\n"
      "  case \"${COMP_WORDS[1]}\" in");
  for (int i = 0; i < commands->count; i++) {
    bash_command(&commands->list[i]);
  }
  puts(
      "  esac\n"
      "  case \"$current\" in\n"
      "    -*) COMPREPLY=($(compgen -W \"$words\" -- \"$current\")) ;;\n"
      "    *) COMPREPLY=($(compgen -W \"$operands\" -- \"$current\")) ;;\n"
      "  esac\n"
      "}\n"
      "complete -o bashdefault -o default -F _orbmorph orbmorph");
}

/* Escapes text for single quotes and the brackets of _arguments. */
static void zsh_text(const char *text) {
  for (; *text; text++) {
    if (*text == '\'') {
      fputs("'\\''", stdout);
    } else if (strchr("[]:", *text)) {
      printf("\\%c", *text);
    } else {
      putchar(*text);
    }
  }
}

static void zsh_command(const cli_command *command) {
  printf("    %s)\n      _arguments -s", command->name);
  for (int id = 0; id < OPT_COUNT; id++) {
    const cli_option *o = &cli_options[id];
    if (!(command->options & CLI_BIT(id))) {
      continue;
    }
    printf(" \\\n        '%s--%s[", id == OPT_SET || id == OPT_TAKE_PART ? "*" : "", o->name);
    zsh_text(o->help);
    putchar(']');
    if (o->choices) {
      printf(":%s:(%s)", o->value, o->choices);
    } else if (o->value) {
      printf(":%s:%s", o->value, strcmp(o->value, "FILE") ? "" : "_files");
    }
    putchar('\'');
  }
  if (command->words) {
    printf(" \\\n        '1:what:(%s)'", command->words);
  } else {
    fputs(" \\\n        '*:file:_files'", stdout);
  }
  puts(" ;;");
}

static void zsh(const cli_commands *commands) {
  puts(
      "#compdef orbmorph\n# Completions of orbmorph for zsh, printed by 'orbmorph completions zsh'.\n"
      "_orbmorph() {\n  local -a commands\n  commands=(");
  for (int i = 0; i < commands->count; i++) {
    printf("    '%s:", commands->list[i].name);
    zsh_text(commands->list[i].summary);
    puts("'");
  }
  puts(
      "  )\n  if (( CURRENT == 2 )); then\n    _describe command commands\n    return\n  fi\n"
      "  local command=$words[2]\n  shift words\n  (( CURRENT-- ))\n  case $command in");
  for (int i = 0; i < commands->count; i++) {
    zsh_command(&commands->list[i]);
  }
  puts("  esac\n}\n_orbmorph \"$@\"");
}

/* Escapes text for the single quotes of fish. */
static void fish_text(const char *text) {
  for (; *text; text++) {
    if (*text == '\'' || *text == '\\') {
      putchar('\\');
    }
    putchar(*text);
  }
}

static void fish_command(const cli_command *command) {
  printf("complete -c orbmorph -n __fish_use_subcommand -f -a %s -d '", command->name);
  fish_text(command->summary);
  puts("'");
  if (command->words) {
    printf("complete -c orbmorph -n '__fish_seen_subcommand_from %s' -f -a '%s'\n", command->name, command->words);
  }
  for (int id = 0; id < OPT_COUNT; id++) {
    const cli_option *o = &cli_options[id];
    if (!(command->options & CLI_BIT(id))) {
      continue;
    }
    printf("complete -c orbmorph -n '__fish_seen_subcommand_from %s' -l %s", command->name, o->name);
    if (o->letter) {
      printf(" -s %c", o->letter);
    }
    if (o->choices) {
      printf(" -x -a '%s'", o->choices);
    } else if (o->value) {
      fputs(" -r", stdout);
    }
    fputs(" -d '", stdout);
    fish_text(o->help);
    puts("'");
  }
}

static void fish(const cli_commands *commands) {
  puts("# Completions of orbmorph for fish, printed by 'orbmorph completions fish'.");
  puts("complete -c orbmorph -n __fish_use_subcommand -l help -d 'show help'");
  puts("complete -c orbmorph -n __fish_use_subcommand -l version -d 'show the version'");
  for (int i = 0; i < commands->count; i++) {
    fish_command(&commands->list[i]);
  }
}

int cli_run_completions(cli *c) {
  static const struct {
    const char *name;
    void (*print)(const cli_commands *);
  } shells[] = {{"bash", bash}, {"zsh", zsh}, {"fish", fish}};
  for (size_t i = 0; i < sizeof shells / sizeof shells[0]; i++) {
    if (!strcmp(c->args.operands[0], shells[i].name)) {
      shells[i].print(&c->commands);
      return CLI_DONE;
    }
  }
  cli_error(c, "no completions for '%s'; choose bash, zsh or fish", c->args.operands[0]);
  return CLI_USAGE;
}
