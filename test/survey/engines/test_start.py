import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent

ONE_LOOP = """
import sys
sys.path.append({made!r})
from made import unreadable
from stiction_ros.survey.engines.engine import Task
from stiction_ros.survey.engines.local import LocalEngine
from stiction_ros.survey.entry import SurveyOptions
if __name__ == "__main__":
    for _, found in LocalEngine(1).run([Task("1", unreadable(1))], SurveyOptions(pages=False)):
        print(found.entry.reason)
"""


@pytest.mark.trial
@pytest.mark.parametrize("inside", ["", "raise ImportError('a folder of that name')"])
def test_a_folder_of_the_name_of_the_package_is_not_taken_for_it(
    tmp_path: Path, inside: str
) -> None:
    folder = tmp_path / "stiction_ros"
    folder.mkdir()
    if inside:
        (folder / "__init__.py").write_text(inside)
    script = tmp_path / "elsewhere" / "one_loop.py"
    script.parent.mkdir()
    script.write_text(ONE_LOOP.format(made=str(HERE.parent)))
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout.strip() == "has no column OP", done.stderr[-2000:]
    assert done.stderr == ""
