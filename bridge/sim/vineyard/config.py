"""Section `[vineyard]`: the simulated row, after spur-pruned, vertically shoot-positioned vineyards."""

from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta, Struct

from rolling_panda.config import Positive, load_preset
from rolling_panda.errors import ConfigError

Share = Annotated[float, Meta(ge=0.0, le=1.0)]
Metres = Annotated[float, Meta(ge=-1e3, le=1e3)]
Count = Annotated[int, Meta(ge=0, le=100)]


class VineyardConfig(Struct, frozen=True, forbid_unknown_fields=True):
    """Ranges from which `grow` draws. Pairs are lower and upper end; lengths in metres, angles in radians.

    In a file, keys that are given replace those of the preset (`load_vineyard`).

    Attributes:
        preset: Values of all other keys, as of vines of one growth: `standard`, or one of `PRESETS`.
        training: `cordon`: two permanent arms with spurs. `guyot`: one cane of last year laid along the wire, and a
            spur of two nodes beside it.
        row_distance: y of the row, which runs along +x.
        first_vine_x: x of the trunk of vine 0.
        vines: Number of vines.
        vine_spacing: Distance between trunks.
        vines_per_post: Vines between two posts.
        post_radius: Radius of a post.
        post_height: Height of a post.
        wires: Heights of the wires above the cordon; the fruiting wire under the cordon is always there.
        wire_radius: Radius of every wire.
        cordon_height: Height of the cordon's axis above the ground.
        cordon_radius: Radius of an arm at its end and at the trunk.
        trunk_radius: Radius of a trunk at the head and at the ground.
        first_spur: Distance from the trunk to the first spur along an arm.
        spur_spacing: Distance between two spurs on an arm.
        spurs_per_arm: Largest number of spurs on an arm.
        stub_length: Length of a spur's two-year wood outside the cordon.
        stub_radius: Radius of that stub.
        cane_shares: Fractions of spurs with one, two and three canes.
        cane_length: Length of a one-year cane.
        cane_radius: Limits of the radius of a cane at its base.
        cane_radius_mean: Mean of that radius.
        cane_radius_deviation: Standard deviation of that radius.
        cane_taper: Radius at the tip as a fraction of that at the base.
        cane_tilt: Standard deviation of a cane's lean along the row; half of that across the row.
        basal: Distance from the cane's base, at the stub's surface, to the middle of the basal bud.
        internode: Distance between the middles of two nodes.
        node_length: Length of a node.
        node_swelling: Radius of a node as a factor of the cane's radius.
        cane_droop: Lean of a cane's tip under its weight.
        laterals: Fraction of nodes with a lateral shoot, where `[world]` has no more.
        guyot_wire: Height of the fruiting wire above the ground where vines are trained as Guyot, in place of
            `cordon_height`.
        guyot_head: So far below this wire a Guyot vine's trunk ends.
        guyot_nodes: Shoots on the cane of last year.
        guyot_radius: Radius of that cane at its tip and at the head.
        old_cut: Height of the old cut on the tip of a stub.
        old_cuts_a_vine: Number of old cuts on trunk and arms.
        ties_a_vine: Number of ties of arms to the wire.
        hose_height: Height of the drip hose above the ground; 0 for none.
        hose_radius: Radius of the drip hose.
        rows_behind: Visible rows behind this one.
        row_spacing: Distance between two rows.
    """

    preset: Literal["standard", "short_internodes", "vigorous", "drooping"] = "standard"
    training: Literal["cordon", "guyot"] = "cordon"
    row_distance: Metres = 0.75
    first_vine_x: Metres = 0.5
    vines: Annotated[int, Meta(ge=1, le=100)] = 3
    vine_spacing: Positive = 1.8
    vines_per_post: Annotated[int, Meta(ge=1, le=20)] = 3
    post_radius: Positive = 0.038
    post_height: Positive = 1.95
    wires: tuple[Positive, ...] = (0.3, 0.6, 0.9)
    wire_radius: Positive = 0.00125
    cordon_height: Positive = 0.9
    cordon_radius: tuple[Positive, Positive] = (0.012, 0.020)
    trunk_radius: tuple[Positive, Positive] = (0.024, 0.032)
    first_spur: tuple[Positive, Positive] = (0.07, 0.12)
    spur_spacing: tuple[Positive, Positive] = (0.09, 0.15)
    spurs_per_arm: Annotated[int, Meta(ge=1, le=30)] = 7
    stub_length: tuple[Positive, Positive] = (0.03, 0.08)
    stub_radius: tuple[Positive, Positive] = (0.006, 0.009)
    cane_shares: tuple[Share, Share, Share] = (0.15, 0.7, 0.15)
    cane_length: tuple[Positive, Positive] = (0.9, 1.5)
    cane_radius: tuple[Positive, Positive] = (0.0025, 0.0065)
    cane_radius_mean: Positive = 0.004
    cane_radius_deviation: Positive = 0.0008
    cane_taper: Positive = 0.5
    cane_tilt: Share = 0.12
    basal: tuple[Positive, Positive] = (0.01, 0.04)
    internode: tuple[Positive, Positive] = (0.06, 0.10)
    node_length: tuple[Positive, Positive] = (0.010, 0.014)
    node_swelling: tuple[Positive, Positive] = (1.35, 1.5)
    cane_droop: tuple[Share, Share] = (0.0, 0.15)
    laterals: Share = 0.0
    guyot_wire: Positive = 0.7
    guyot_head: Positive = 0.12
    guyot_nodes: Annotated[int, Meta(ge=3, le=20)] = 8
    guyot_radius: tuple[Positive, Positive] = (0.0045, 0.007)
    old_cut: tuple[Positive, Positive] = (0.004, 0.010)
    old_cuts_a_vine: tuple[Count, Count] = (2, 6)
    ties_a_vine: tuple[Count, Count] = (2, 4)
    hose_height: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.5
    hose_radius: Positive = 0.008
    rows_behind: Annotated[int, Meta(ge=0, le=5)] = 1
    row_spacing: Positive = 2.5

    @property
    def fruiting_wire(self) -> float:
        """Height of the arms or canes that are tied along the row (m)."""
        return self.guyot_wire if self.training == "guyot" else self.cordon_height

    def check(self) -> None:
        """Check the ranges.

        Raises:
            ConfigError: A range is reversed, or the shares of canes do not add up to 1.
        """
        for name in self.__struct_fields__:
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) == 2 and value[0] > value[1]:
                raise ConfigError(f"[vineyard] {name} = {list(value)} runs backwards; write the smaller value first")
        if abs(sum(self.cane_shares) - 1.0) > 1e-6:
            raise ConfigError(f"[vineyard] cane_shares add up to {sum(self.cane_shares):.3f}; they must add up to 1")
        if self.node_length[1] / 2 > self.basal[0] or self.node_length[1] >= self.internode[0]:
            raise ConfigError("[vineyard] nodes would overlap; shorten node_length or lengthen basal and internode")


#: Guyot vines, and the distance at which the robot drives along them: their last cut is as high as the arm reaches.
GUYOT_ROW = VineyardConfig(training="guyot", row_distance=0.55)

#: Vines that differ as cultivars do in what matters to winter pruning; they are named after the trait, as site and year
#: change these numbers as much as the cultivar does. Spreads without a source are chosen.
PRESETS: dict[str, VineyardConfig] = {
    "standard": VineyardConfig(),
    # Means of Cabernet Sauvignon on a vertical trellis: internodes 53 mm, shoots 1.30 m, 14.0 shoots a metre of row,
    # 64 g a shoot (W. M. Kliewer and N. K. Dokoozlian, "Leaf area/crop weight ratios of grapevines: influence on fruit
    # composition and wine quality", American Journal of Enology and Viticulture 56 (2005) 170-181, table 3). At
    # 1000 kg/m^3 such a shoot is up to 10 mm thick at its base; some of the weight is that of laterals, and 9 mm is
    # chosen. Only means are published: the spread of internodes is as wide in proportion as that of `standard`.
    "short_internodes": VineyardConfig(
        preset="short_internodes",
        internode=(0.040, 0.066),
        cane_length=(1.1, 1.5),
        cane_shares=(0.25, 0.7, 0.05),
        cane_radius_mean=0.0045,
    ),
    # Vigorous shoots have long internodes and are thick; internodes of cuttings are 50 to 150 mm ("internode", in:
    # J. Robinson (editor), The Oxford Companion to Wine, 3rd edition, 2006). The numbers are chosen within that.
    "vigorous": VineyardConfig(
        preset="vigorous",
        internode=(0.080, 0.140),
        cane_length=(1.2, 1.8),
        cane_shares=(0.05, 0.55, 0.40),
        cane_radius=(0.0035, 0.0070),
        cane_radius_mean=0.0050,
        cane_radius_deviation=0.0010,
        stub_radius=(0.0075, 0.0105),
        laterals=0.15,
    ),
    # Canes lean and hang over, as of cultivars that do not grow upright. One is Syrah: its canes spread sideways where
    # nothing holds them (Tablas Creek Vineyard, "Why you trellis Syrah", 2010). It has more laterals than Grenache
    # (G. Louarn, Y. Guédon, J. Lecoeur and E. Lebon, "Quantitative analysis of the phenotypic variability of shoot
    # architecture in two grapevine (Vitis vinifera) cultivars", Annals of Botany 99 (2007) 425-437). All numbers are
    # chosen.
    "drooping": VineyardConfig(
        preset="drooping",
        cane_tilt=0.22,
        cane_droop=(0.3, 1.0),
        laterals=0.10,
    ),
}


def load_vineyard(path: Path) -> VineyardConfig:
    """The section `[vineyard]` of a configuration file: the preset, with the keys that are given.

    Raises:
        ConfigError: As of `load_section`.
    """
    return load_preset(path, "vineyard", PRESETS)
