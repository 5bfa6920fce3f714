"""An HTML page in a headless browser of a given width: what a script finds in it, and what its console says."""

import base64
import html
import json
import re
import shutil
import subprocess

import pytest

HARNESS = """<!DOCTYPE html><meta charset="utf-8"><body style="margin:0">
<iframe style="border:0;width:{width}px;height:900px" srcdoc="{page}"></iframe><script>
const frame = document.querySelector("iframe"), told = [];
frame.onload = async () => {{
  const page = frame.contentDocument, view = frame.contentWindow, wait = time => new Promise(f => setTimeout(f, time));
  view.onerror = (...error) => told.push(error.slice(0, 3).join(" "));
  let found;
  try {{ found = await (async () => {{ {script} }})(); }} catch (error) {{ told.push(String(error)); }}
  const text = unescape(encodeURIComponent(JSON.stringify({{found, told}})));
  document.body.innerHTML = "<pre>" + btoa(text) + "</pre>";
}};
</script></body>"""


def in_browser(page, script, folder, width=1280):
    """What a script returns, as JSON, in a frame of this width that shows the page; its own policy stays in force.

    The script sees `page` (the document), `view` (its window) and `wait(milliseconds)`. Fails on any error, and on what
    the page writes to its console.
    """
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        pytest.skip("no headless browser is installed")
    harness = HARNESS.format(width=width, page=html.escape(page), script=script)
    (folder / "harness.html").write_text(harness, encoding="utf-8")
    given = ["--headless", "--no-sandbox", "--disable-gpu", "--window-size=1400,900", "--virtual-time-budget=20000"]
    given += ["--enable-logging=stderr", "--dump-dom", f"--user-data-dir={folder / 'profile'}"]
    command = [program, *given, (folder / "harness.html").as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert "CONSOLE" not in done.stderr, done.stderr
    answer = re.search(r"<pre>([A-Za-z0-9+/=]+)</pre>", done.stdout)
    assert answer, done.stdout[-300:] + done.stderr
    content = json.loads(base64.b64decode(answer[1]))
    assert content["told"] == []
    return content.get("found")
