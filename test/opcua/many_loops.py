"""A server with many loops of one valve each, PV and OP new at every scan; for trials by hand.

``python test/opcua/many_loops.py PORT LOOPS FILE`` serves on 127.0.0.1 without security and writes
the tag map to FILE.
"""

import asyncio
import datetime
import logging
import sys
import time
from pathlib import Path

import numpy as np
import yaml
from asyncua import Server, ua

SPACE = "urn:many"


async def serve(port: int, count: int, file: Path) -> None:
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/many")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    space = await server.register_namespace(SPACE)
    nodes = []
    for i in range(count):
        row = []
        for key in ("PV", "SP", "OUT"):
            name = f"L{i}.{key}"
            made = ua.NodeId(name, space)
            title = ua.QualifiedName(name, space)
            await server.nodes.objects.add_variable(made, title, 0.0, ua.VariantType.Double)
            row.append(made)
        nodes.append(row)
    loops = [
        {
            "loop": f"L{i}",
            "sample_time": 1.0,
            "outputs": [{"name": "PV1", "pv": node(i, "PV"), "sp": node(i, "SP")}],
            "valves": [{"name": "V1", "op_read": node(i, "OUT")}],
        }
        for i in range(count)
    ]
    told = {"server": f"opc.tcp://127.0.0.1:{port}/many", "loops": loops}
    random = np.random.default_rng(1)
    async with server:
        file.write_text(yaml.safe_dump(told), encoding="utf-8")
        print("listening", flush=True)
        due, k = time.time(), 0
        while True:
            moment = datetime.datetime.fromtimestamp(due, datetime.UTC)
            noise = random.standard_normal((count, 2))
            for i, row in enumerate(nodes):
                for node_id, value in zip(
                    row, (k + noise[i, 0], 50.0, 50 + noise[i, 1]), strict=True
                ):
                    await server.write_attribute_value(
                        node_id,
                        ua.DataValue(
                            ua.Variant(float(value), ua.VariantType.Double), SourceTimestamp=moment
                        ),
                    )
                if i % 10 == 0:
                    await asyncio.sleep(0)
            k, due = k + 1, due + 1.0
            await asyncio.sleep(max(due - time.time(), 0.0))


def node(i: int, key: str) -> str:
    return f"nsu={SPACE};s=L{i}.{key}"


if __name__ == "__main__":
    asyncio.run(serve(int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])))
