// knead completion: prints a completion script for the shell. The script runs the programs to get the lists of their
// options.
#include "clients/cli/command.h"
#include "clients/cli/commands.h"
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

// Text of the completion script. It is a file of the source tree that the build embeds in the program. `cmake
// --install` installs the same file.
extern const char completion_bash[];
__asm__(".section .rodata\ncompletion_bash: .incbin \"" KN_CLIENTS_DIR
        "/knead/completion.bash\"\n.byte 0\n.previous\n");

static const char help[] =
    "usage: knead completion [bash|zsh]\n\n"
    "Print the shell completion of knead, kneadd and knead-simdev: commands, options, their values, keys of a\n"
    "scene, files. When Tab is pressed, the completion reads the --help of these programs. An installation has the\n"
    "completion where bash and zsh find it. Otherwise `source <(knead completion)` loads it into this shell.\n\n"
    "Examples:\n"
    "    knead completion >knead.bash\n"
    "    knead completion zsh >knead.zsh\n\n"
    "Exit codes: 0 ok, 2 bad input.\n";

int kn_completion_main(int argc, char **argv)
{
    const char *shell = argc > 1 ? argv[1] : "bash";
    const bool zsh = !strcmp(shell, "zsh");
    if (argc > 2 || !(zsh || !strcmp(shell, "bash") || !strcmp(shell, "--help")))
        return kn_complain("completion", KN_EXIT_USAGE, "%s: expected bash or zsh", argv[argc > 2 ? 2 : 1]);
    if (!strcmp(shell, "--help")) return fputs(help, stdout), KN_EXIT_OK;
    // zsh needs these commands before the bash script, because zsh runs the script in its compatibility layer.
    if (zsh) fputs("autoload -U +X compinit && compinit -i\nautoload -U +X bashcompinit && bashcompinit\n", stdout);
    fputs(completion_bash, stdout);
    return KN_EXIT_OK;
}
