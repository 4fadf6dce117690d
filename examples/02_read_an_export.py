"""An export with the historian's own column names, ISO stamps and a gap.

For control engineers. What was left out is said in the notes of the record.
"""

import datetime
from pathlib import Path

from stiction_ros import CsvColumns, LoopModel, Record, find_config, read, simulate

BEGIN = datetime.datetime(2024, 3, 1, 6, 0, tzinfo=datetime.UTC)


def export(record: Record, path: Path, missing: range) -> None:
    """Write what a historian would: tags with dots, stamps, and ``missing`` rows left out."""
    rows = ["stamp,FIC101.OP,FIC101.PV"]
    for k in range(len(record)):
        if k not in missing:
            stamp = BEGIN + datetime.timedelta(seconds=k * record.sample_time)
            rows.append(f"{stamp.isoformat()},{record.op[k, 0]:.4f},{record.pv[k, 0]:.4f}")
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def main(samples: int = 1000) -> None:
    """Write such a file, and read it by naming its columns."""
    record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=samples)
    path = Path("export.csv")
    export(record, path, range(samples // 5, samples // 4))
    columns = CsvColumns(op={"V101": "FIC101.OP"}, pv={"FIC101": "FIC101.PV"}, time="stamp")
    part = read(path, columns)
    print(f"{len(part)} of {samples} samples of {part.sample_time:g} s, valve {part.valves[0]}")
    for note in part.notes:
        print(f"note: {note}")


if __name__ == "__main__":
    main()
