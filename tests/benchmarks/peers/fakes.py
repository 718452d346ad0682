"""A peer that misbehaves on request: its setting says how."""

FAKE = """
import json, os, sys, time
setting = ""
for line in sys.stdin:
    request = json.loads(line)
    if request["do"] == "build":
        job = request["job"]
        setting = job["setting"]
        if setting == "crash":
            raise SystemExit("no such thing as a /usr/lib/fake.so")
        if setting == "hang":
            print("thinking", file=sys.stderr, flush=True)
            time.sleep(60)
        if setting == "garbage":
            print("hello", flush=True)
            continue
        if setting == "cannot":
            answer = {"cannot": "not my kind of problem"}
        else:
            answer = {"versions": {"fake": "1.2"}, "remark": "fake", "seconds": 0.5}
    else:
        assert "PYTHONPATH" not in os.environ
        n = job["N"]
        value = float("nan") if setting == "nan" else 0.0
        answer = {
            "seconds": 1e-9,
            "x": [request["x0"]] * (n + 1),
            "u": [[value] * job["nu"]] * n,
            "status": "solved",
        }
        if setting == "poor":
            del answer["u"]
    print(json.dumps(answer), flush=True)
"""
