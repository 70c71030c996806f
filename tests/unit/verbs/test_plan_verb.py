"""`elys plan`: what it prints, for people and for programs."""

from __future__ import annotations

import json


def test_a_person_reads_reasons_figures_and_what_is_saved(elys):
    said = elys("plan", "stack", "--at", "0.5", "--seconds", "0.1").out
    assert "no shapes but boxes and balls among 11 colliders" in said
    assert "a whole tick" in said and "what is saved" in said and "same bits" in said
    assert "debug_lines" in said and "only while somebody listens" in said


def test_a_program_reads_json(elys):
    found = json.loads(elys("plan", "bridge", "--no-measure", "--json").out)
    stages = {stage["name"]: stage for stage in found["physics"]["stages"]}
    assert stages["joints"]["is_on"] and "joints" in stages["joints"]["why"]
    assert found["physics"]["ticks"] == 0 and stages["rolling"]["saving"] is None
    assert bool(found["pictures"]) != bool(found["pictures_missing"])


def test_threads_are_those_of_run(elys):
    found = json.loads(elys("plan", "stack", "--no-measure", "--threads", "2", "--json").out)
    why = {stage["name"]: stage["why"] for stage in found["physics"]["stages"]}
    assert "one thread" not in why["shared_solver"]


def test_a_scene_that_is_not_there_is_one_sentence(elys):
    assert "no sample called 'nowhere'" in elys("plan", "nowhere").sentence
