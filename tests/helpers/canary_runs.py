"""BioNetGen and Antimony themselves, run on what hostile files are turned into: do they create, change or read a file?

Each text is read in a process of its own, in a folder of its own, by libraries that are loaded once.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from kinetics.formats.bngl import _program
from tests.helpers.canaries import SECRET, secrets

# Reads what BNG2.pl reads, with the arguments that it sets.
PERL = r"""
use lib "$ENV{BNGPATH}/Perl2";
use BNGUtils;
use BNGModel;
while (my $folder = <STDIN>) {
    chomp $folder;
    my $child = fork;
    unless ($child) {
        chdir $folder;
        alarm 20;
        open STDOUT, '>', 'said';
        open STDERR, '>&STDOUT';
        my $model = BNGModel->new();
        $model->initialize();
        $BNGModel::GLOBAL_MODEL = $model;
        print $model->readFile({file => 'generate.bngl', skip_actions => 0, action_skip_warn => 1, allow_perl => 0,
                                output_dir => '.', no_exec => 0, write_xml => 0, generate_network => 0});
        exit 0;
    }
    waitpid $child, 0;
    syswrite STDOUT, "done\n";
}
"""
PYTHON = r"""
import antimony, os, sys
for folder in map(str.strip, sys.stdin):
    child = os.fork()
    if not child:
        os.chdir(folder)
        done = antimony.loadAntimonyString(open("model.ant", encoding="utf-8").read())
        names = antimony.getModuleNames() if done >= 0 else []
        open("said", "w", encoding="utf-8").write("\n".join(map(antimony.getAntimonyString, names)))
        os._exit(0)
    os.waitpid(child, 0)
    print(flush=True)
"""


def state(folder):
    """Name -> when it was changed, of the canaries."""
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}


def ran(folder, given):
    """Number and reason of the texts by which the programs created, changed or read a file.

    folder : with the canaries, which the texts name
    given : number -> files of BioNetGen, or text of Antimony
    """
    found = []
    environment = {**os.environ, "BNGPATH": str(_program().parent)}
    with tempfile.TemporaryDirectory() as work:
        for program, kind in ((["perl", "-e", PERL], dict), ([sys.executable, "-c", PYTHON], str)):
            of_kind = {number: text for number, text in given.items() if isinstance(text, kind)}
            with subprocess.Popen(
                program, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            ) as reader:
                for number, text in of_kind.items():
                    room = Path(work, str(number))
                    room.mkdir()
                    for name, content in (text if kind is dict else {"model.ant": text}).items():
                        (room / name).write_text(content, encoding="utf-8")
                    secrets(room)  # beside the text, and in the folder that the file names
                    secrets(folder)
                    before = state(folder)
                    reader.stdin.write(f"{room}\n")
                    reader.stdin.flush()
                    reader.stdout.readline()
                    if state(folder) != before:
                        found.append((number, "created or changed a file"))
                        (folder / "made").unlink(missing_ok=True)
                    made = [path for path in room.iterdir() if not path.name.startswith("secret.")]
                    if any(SECRET in path.read_text("utf-8", errors="replace") for path in made):
                        found.append((number, "read a file"))
                    shutil.rmtree(room)
                reader.stdin.close()
    return found
