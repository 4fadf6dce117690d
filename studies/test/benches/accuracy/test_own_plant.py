from stiction_studies.benches.accuracy.own_plant import MODES, WORSE, OwnPlant, judge


def test_a_plant_is_drawn_again_from_its_seed() -> None:
    one, again, other = (OwnPlant.drawn(seed) for seed in (100, 100, 101))
    assert one.model(sticky=True).to_mapping() == again.model(sticky=True).to_mapping()
    assert one.gain == again.gain != other.gain


def test_by_default_the_embedding_is_no_worse_than_the_inversion_and_moves_less() -> None:
    rows = {row.mode: row for row in judge(101)}
    assert tuple(rows) == MODES
    embedding, inversion = rows["embedding"], rows["inversion"]
    assert embedding.error <= WORSE * inversion.error
    assert embedding.moves < inversion.moves
    assert rows["unaware"].error > inversion.error
