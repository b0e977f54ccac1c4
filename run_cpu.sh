. /tmp/w/env.sh
export PYTHONPATH=$PYTHONPATH:/tmp/w/plug
pytest -p cpu_plugin -n 2 --dist loadfile -m "not slow" -q
