"""Who is admitted to the studio, which files it reads and writes, what is outdated, and what is left when it ends."""

import http.client
import json
import re
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("uvicorn")
pytest.importorskip("websockets")

from websockets.exceptions import ConnectionClosed, InvalidStatus

from tests.shared.commands import Done
from tests.shared.sparse import sparse
from tests.tools.studio.shared import DERAIL, Page, Studio, running

SLOW = """\
taskspec: 1
name: Slow
state:
  x: {type: int, low: 0, high: 299}
  y: {type: int, low: 0, high: 299}
action:
  a: {type: int, low: 0, high: 9}
horizon: 40
initial:
  x: UniformInt(0, 299)
  y: UniformInt(0, 299)
dynamics:
  x': clip(x + a - 5, 0, 299)
  y': clip(y + UniformInt(0, 4), 0, 299)
reward: x' == y'
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("specs").resolve() / "mine"
    place.mkdir()
    shutil.copy(DERAIL / "risky_path.yaml", place)
    return place


@pytest.fixture(scope="module")
def studio(folder: Path) -> Iterator[Studio]:
    with running(folder) as found:
        yield found


@pytest.fixture
def page(studio: Studio) -> Iterator[Page]:
    with studio.connect() as socket:
        yield Page(socket)


def status(studio: Studio, path: str, **headers: str) -> tuple[int, dict[str, str]]:
    connection = http.client.HTTPConnection(studio.host, timeout=30)
    connection.putrequest("GET", path, skip_host=True)
    for name, value in {"Host": studio.host, **headers}.items():
        connection.putheader(name, value)
    connection.endheaders()
    found = connection.getresponse()
    found.read()
    connection.close()
    return found.status, {name.lower(): value for name, value in found.getheaders()}


def test_the_page_needs_the_token_and_the_right_host(studio: Studio) -> None:
    found, headers = status(studio, f"/?token={studio.token}")
    assert found == 200
    assert "script-src 'self';" in headers["content-security-policy"]
    assert status(studio, "/")[0] == 403
    assert status(studio, f"/?token={studio.token}x")[0] == 403
    assert status(studio, f"/?token={studio.token}", Host="evil.example")[0] == 403
    assert status(studio, f"/?token={studio.token}", Origin="http://evil.example")[0] == 403
    assert status(studio, "/static/pages/style.css")[0] == 200
    assert status(studio, "/static/pages/style.css", Host="evil.example")[0] == 403
    for path in ("/static/../server.py", "/static/%2e%2e/server.py", "/static/pages/%2e%2e/write.py"):
        assert status(studio, path)[0] in (403, 404)


@pytest.mark.parametrize("path", ["/live", "/lsp"])
@pytest.mark.parametrize("wrong", [{"token": ""}, {"token": "guess"}, {"origin": "http://evil.example"}])
def test_websockets_need_the_token_and_the_pages_origin(studio: Studio, path: str, wrong: dict[str, str]) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        studio.connect(path, **wrong)


def test_it_listens_on_this_machine_alone(studio: Studio) -> None:
    port = f"{int(studio.host.rpartition(':')[2]):04X}"
    listening = re.findall(rf"^ *\d+: (\w+):{port} \S+ 0A ", Path("/proc/net/tcp").read_text(), re.MULTILINE)
    assert listening == ["0100007F"]


def test_a_strange_message_is_refused_and_a_long_one_closes_the_socket(page: Page) -> None:
    for message in ("", "[]", "{}", '{"id": 1, "kind": "eval"}', '{"id": 1, "kind": ["page"]}', "[" * 9000):
        page.socket.send(message)
        assert page.receive()["ok"] is False
    for kind in ("page", "open", "save", "play"):
        assert page.refusal(kind, text=7, path=[])["message"]
    page.socket.send(json.dumps({"id": 1, "kind": "page", "text": "x" * 5_000_000}))
    with pytest.raises(ConnectionClosed):
        page.receive()


def test_a_spec_is_saved_unless_it_was_changed_outside(page: Page, folder: Path) -> None:
    opened = page.ask("open", path="risky_path.yaml")
    place = folder / "risky_path.yaml"
    assert opened["text"] == place.read_text()
    text = opened["text"].replace("horizon: 5", "horizon: 6")
    saved = page.ask("save", path="risky_path.yaml", text=text, digest=opened["digest"])
    assert place.read_text() == text
    assert page.ask("save", path="risky_path.yaml", text=text, digest=saved["digest"])["digest"] == saved["digest"]
    place.write_text("# mine\n")
    refused = page.refusal("save", path="risky_path.yaml", text=text, digest=saved["digest"])
    assert refused["refused"] == "changed"
    assert place.read_text() == "# mine\n"
    place.unlink()
    assert page.refusal("save", path="risky_path.yaml", text=text, digest=saved["digest"])["refused"] == "changed"
    shutil.copy(DERAIL / "risky_path.yaml", folder)


def test_a_new_spec_is_written_once(page: Page, folder: Path) -> None:
    template = page.ask("new", path="my_walk.yaml", **{"from": "template:corridor"})["text"]
    assert "name: MyWalk" in template
    assert page.ask("claims", text=template)["claims"][0]["status"] == "proved"
    assert not (folder / "my_walk.yaml").exists()
    page.ask("save", path="deep/my_walk.yaml", text=template, digest=None)
    assert (folder / "deep" / "my_walk.yaml").read_text() == template
    assert page.refusal("save", path="deep/my_walk.yaml", text="", digest=None)["refused"] == "exists"
    assert page.ask("files")["files"] == ["risky_path.yaml", "deep/my_walk.yaml"]
    known = page.ask("new", **{"from": "derail/RiskyPath-v0"})["text"]
    assert known == (DERAIL / "risky_path.yaml").read_text()
    assert page.refusal("new", **{"from": "../../etc/passwd"})["problems"][0]["code"] == "E701"


HOSTILE = ("../out.yaml", "/tmp/out.yaml", "link/out.yaml", "link.yaml", "", ".", "a\0.yaml", "x" * 5000 + ".yaml")


@pytest.mark.parametrize("path", HOSTILE)
def test_nothing_outside_the_folder_is_read_or_written(page: Page, folder: Path, path: str) -> None:
    outside = folder.parent / "out.yaml"
    outside.write_text("secret: 1\n")
    for name, target in (("link", folder.parent), ("link.yaml", outside)):
        if not (folder / name).is_symlink():
            (folder / name).symlink_to(target)
    for kind, more in (("open", {}), ("save", {"text": "x", "digest": None}), ("page", {"text": "x"})):
        refused = page.refusal(kind, path=path, **more)
        assert "secret" not in json.dumps(refused)
    assert not any(name.startswith("link") for name in page.ask("files")["files"])
    assert outside.read_text() == "secret: 1\n"


@pytest.mark.parametrize("path", ["run.py", ".hidden.yaml", "risky_path"])
def test_only_specs_are_written(page: Page, folder: Path, path: str) -> None:
    assert page.refusal("save", path=path, text="x", digest=None)["refused"] == "name"
    assert not (folder / path).exists()


def test_the_newest_question_is_answered_and_older_ones_are_outdated(page: Page) -> None:
    text = (DERAIL / "risky_path.yaml").read_text()
    for _ in range(3):
        page.send("scores", text=SLOW)
    newest = page.send("scores", text=text)
    for _ in range(4):
        answer = page.receive()
        assert answer["ok"] if answer["id"] == newest else answer["outdated"]
    assert page.ask("page", text=text)["name"] == "RiskyPath"


def test_kinds_do_not_wait_for_each_other(page: Page) -> None:
    slow = page.send("scores", text=SLOW)
    quick = page.send("page", text=SLOW)
    assert page.receive()["id"] == quick
    page.send("scores", text="taskspec: 1")
    assert {page.receive()["id"], page.receive()["id"]} == {slow, slow + 2}


def test_each_page_has_a_language_server_of_its_own(studio: Studio, folder: Path) -> None:
    place = folder / "risky_path.yaml"
    text = place.read_text().replace("safe: detour", "safe: detuor")
    for _ in range(2):
        with studio.connect("/lsp") as socket:

            def send(**message: object) -> None:
                socket.send(json.dumps({"jsonrpc": "2.0", **message}))

            send(id=1, method="initialize", params={"capabilities": {}, "processId": None, "rootUri": None})
            assert json.loads(socket.recv(60))["result"]["capabilities"]["hoverProvider"]
            send(method="initialized", params={})
            document = {"uri": place.as_uri(), "languageId": "yaml", "version": 7, "text": text}
            send(method="textDocument/didOpen", params={"textDocument": document})
            found = json.loads(socket.recv(60))["params"]
            assert (found["version"], found["diagnostics"][0]["code"]) == (7, "E313")


@pytest.mark.parametrize("sent", sparse([signal.SIGTERM, signal.SIGINT, signal.SIGKILL, signal.SIGHUP], 2))
def test_no_process_is_left(folder: Path, sent: signal.Signals) -> None:
    studio = Studio(folder / "risky_path.yaml")
    with studio.connect() as socket, studio.connect("/lsp"):
        page = Page(socket)
        assert page.ask("files")["opened"] == "risky_path.yaml"
        page.ask("page", text=SLOW)
        page.send("scores", text=SLOW)
        time.sleep(1)
        assert len(studio.processes()) > 2
        assert studio.end(sent) == []


@pytest.mark.parametrize(
    ("target", "code"), [(["nothing.yaml"], "E710"), (["model.py"], "E711"), ([".", "--port"], "E713")]
)
def test_a_target_that_cannot_be_served_is_an_error(
    studio: Studio, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, target: list[str], code: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.py").write_text("")
    if "--port" in target:
        target = [*target, studio.host.rpartition(":")[2]]  # which is taken
    done = Done("studio", *target, "--no-browser")
    assert done.status != 0
    assert code in done.err


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    done = Done("studio")
    assert "E705" in done.err
    assert "[studio]" in done.err
