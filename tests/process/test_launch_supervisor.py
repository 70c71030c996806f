"""The supervisor with real processes: prefixes, crashes, restarts, and nobody left behind."""

from __future__ import annotations

import asyncio
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from elys.common.errors import LaunchError
from elys.launch import fill_in, read_launch_file, run_processes

pytestmark = pytest.mark.process
SUPERVISE = """
from pathlib import Path
from elys.launch import fill_in, read_launch_file, run_processes
run_processes(fill_in(read_launch_file(Path({path!r})), {{}}))
"""


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def described(tmp_path: Path, *processes: str):
    return fill_in(read_launch_file(write(tmp_path / "it.toml", "\n".join(processes))), {})


def process(name: str, code: str, extra: str = "") -> str:
    return f'[[process]]\nname = "{name}"\ncommand = [{sys.executable!r}, "-c", {code!r}]\n{extra}\n'


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def wait_until(condition, *, seconds: float = 10.0) -> bool:
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)  # other processes tell us nothing: there is nothing to wait on but the clock
    return True


def test_main_process_ends_all_and_lines_carry_their_process(tmp_path, capfd):
    pid_file = tmp_path / "pid"
    forever = f"import os, time; open({str(pid_file)!r}, 'w').write(str(os.getpid())); print('up'); time.sleep(60)"
    wait_for_other = f"import os, time\nwhile not os.path.exists({str(pid_file)!r}): time.sleep(0.01)\nprint('done')"
    status = run_processes(
        described(tmp_path, process("forever", forever), process("main", wait_for_other, "main = true"))
    )
    assert status == 0
    assert not is_alive(int(pid_file.read_text()))
    assert "main │ done" in capfd.readouterr().err


def test_crash_is_reported_with_the_tail_of_its_log_and_its_status(tmp_path, capfd):
    status = run_processes(described(tmp_path, process("bad", "print('the cause'); raise SystemExit(3)")))
    shown = capfd.readouterr().err
    assert status == 3
    assert "ended with status 3" in shown
    assert "    the cause" in shown


def test_a_process_that_may_restart_comes_back_and_is_given_up_when_hopeless(tmp_path, capfd):
    status = run_processes(described(tmp_path, process("bad", "raise SystemExit(7)", 'restart = "on-crash"')))
    assert status == 7
    assert capfd.readouterr().err.count("ended with status 7") == 5


def test_no_orphan_when_the_supervisor_is_killed(tmp_path):
    pid_file = tmp_path / "pid"
    child = f"import os, time; open({str(pid_file)!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    path = write(tmp_path / "it.toml", process("child", child))
    code = SUPERVISE.format(path=str(path))
    supervisor = subprocess.Popen([sys.executable, "-c", code])
    assert wait_until(lambda: pid_file.exists() and pid_file.read_text() != "")
    supervisor.kill()
    supervisor.wait()
    assert wait_until(lambda: not is_alive(int(pid_file.read_text())))


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_the_supervisor_ends_all_in_order(tmp_path, number):
    pid_file = tmp_path / "pid"
    ended = tmp_path / "ended"
    child = (
        "import os, signal, sys, time\n"
        f"signal.signal(signal.SIGTERM, lambda *_: (open({str(ended)!r}, 'w').write('cleanly'), sys.exit(0)))\n"
        f"open({str(pid_file)!r}, 'w').write(str(os.getpid()))\n"
        "time.sleep(60)"
    )
    path = write(tmp_path / "it.toml", process("child", child))
    code = SUPERVISE.format(path=str(path))
    supervisor = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.PIPE, text=True)
    assert wait_until(lambda: pid_file.exists() and pid_file.read_text() != "")
    supervisor.send_signal(number)
    _, shown = supervisor.communicate(timeout=20)
    assert ended.read_text() == "cleanly"
    assert "Traceback" not in shown


def test_who_is_being_started_when_all_shall_end_is_asked_to_end_too(tmp_path, monkeypatch):
    starting = asyncio.create_subprocess_exec

    async def start_slowly(*command, **settings):
        process = await starting(*command, **settings)
        await asyncio.sleep(1.0)
        return process

    monkeypatch.setattr(asyncio, "create_subprocess_exec", start_slowly)
    ended = tmp_path / "ended"
    child = (
        "import os, signal, sys, time\n"
        f"signal.signal(signal.SIGTERM, lambda *_: (open({str(ended)!r}, 'w').write('cleanly'), sys.exit(0)))\n"
        "os.kill(os.getppid(), signal.SIGTERM)\n"
        "time.sleep(60)"
    )
    run_processes(described(tmp_path, process("child", child)))
    assert ended.read_text() == "cleanly"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "describes no [[process]]"),
        ("title = ", "it.toml"),
        ('[[process]]\nname = "a"', "missing required field `command`"),
        ('[[process]]\nname = "a"\ncommand = ["x"]\ncolour = "red"', "unknown field `colour`"),
        (
            '[[process]]\nname = "a"\ncommand = ["x"]\n[[process]]\nname = "a"\ncommand = ["x"]',
            "two processes of one name",
        ),
        (
            '[[process]]\nname = "a"\ncommand = ["x"]\nmain = true\n[[process]]\nname = "b"\ncommand = ["x"]\nmain = true',
            "more than one main",
        ),
        ('[[process]]\nname = "a"\ncommand = []', "empty command"),
        ('[[process]]\nname = "a"\ncommand = ["{scene}"]', "uses {scene}, which is no parameter"),
        ('[[process]]\nname = "a"\ncommand = ["{"]', "cannot be filled in"),
        ('[parameters]\nscene = "what to run"\n[[process]]\nname = "a"\ncommand = ["x"]', "add scene=VALUE"),
    ],
)
def test_a_wrong_launch_file_is_one_sentence(tmp_path, text, sentence):
    with pytest.raises(LaunchError, match=__import__("re").escape(sentence)):
        fill_in(read_launch_file(write(tmp_path / "it.toml", text)), {})


def test_a_command_that_does_not_exist_is_one_sentence(tmp_path):
    with pytest.raises(LaunchError, match="'ghost' cannot be started"):
        run_processes(described(tmp_path, '[[process]]\nname = "ghost"\ncommand = ["no-such-program-here"]'))


def test_every_launch_file_of_the_project_can_be_read():
    for path in sorted((Path(__file__).parents[2] / "launch").glob("*.toml")):
        described_file = read_launch_file(path)
        assert described_file.title
        assert fill_in(described_file, dict.fromkeys(described_file.parameters, "x"))
