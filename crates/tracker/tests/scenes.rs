//! A part of `make validate`: shortened scenes on seeds that nothing was tuned on, from pixels to names.

#[path = "../examples/validate/films.rs"]
#[expect(dead_code, reason = "the sweep uses more of it")]
mod films;

use films::Filmed;
use rayon::prelude::*;
use tracker::synth::preset;

#[test]
fn on_films_never_tuned_on_no_name_is_wrong_and_what_is_seen_is_named() {
    let films = [("glints", 104, 0.998), ("dropout", 105, 0.998), ("fast", 106, 0.998)];
    films.into_par_iter().for_each(|(name, seed, least)| {
        let mut scene = preset(name, seed).unwrap();
        scene.frames = 400;
        let got = Filmed::of(&scene).unwrap().follow().unwrap();
        let s = &got.score;
        assert!(got.rig_right, "{name} {seed}");
        assert_eq!((s.wrong, s.switches, s.false_positives), (0, 0, 0), "{name} {seed} {:?}", s.first_wrong);
        assert!(s.coverage >= least, "{name} {seed} {}", s.coverage);
        let back = &s.reacquisition;
        assert!(back.within_3 == back.cases, "{name} {seed} {back:?}");
    });
}
