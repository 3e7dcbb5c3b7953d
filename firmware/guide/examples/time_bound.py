# time_bound.py LIMIT_MS [STATION]
import sys

from captain_client import Station

limit_ns = float(sys.argv[1]) * 1e6
was_good = None
with Station(*sys.argv[2:]) as box:
    while True:
        now = box.time()
        is_good = now["error_ns"] is not None and now["error_ns"] <= limit_ns
        bound = "unknown" if now["error_ns"] is None else f"{now['error_ns'] / 1e6:.3f} ms"
        if is_good != was_good:
            print("good:" if is_good else "not good:", f"{now['state']}, error at most {bound}", flush=True)
        was_good = is_good
