//! A part of `make validate`: shortened scenes on seeds that nothing was tuned on, from pixels to names.

#[path = "../examples/validate/films.rs"]
#[expect(dead_code, reason = "the sweep uses more of it")]
mod films;

use films::Filmed;
use rayon::prelude::*;
use tracker::synth::{View, preset};

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

#[test]
fn tilted_and_bent_pictures_and_other_mechanisms_are_followed_without_settings() {
    let tilted = View { tilt_deg: 10.0, ..View::default() };
    let barrel = View { k1: -0.2, ..View::default() };
    let both = View { tilt_deg: 12.0, towards_deg: 50.0, k1: -0.08, ..View::default() };
    let films = [
        ("clean", Some(tilted), 0.998),
        ("clean", Some(barrel), 0.998),
        ("pairs", None, 0.97),
        ("pairs", Some(both), 0.97),
        ("triple", Some(both), 0.97),
        ("symmetric", None, 0.97),
    ];
    films.into_par_iter().for_each(|(name, view, least)| {
        let mut scene = preset(name, 104).unwrap();
        scene.frames = 400;
        scene.camera.view = view;
        let got = Filmed::of(&scene).unwrap().follow().unwrap();
        let s = &got.score;
        assert!(got.rig_right, "{name} {view:?}");
        assert_eq!(
            (s.wrong, s.switches, s.false_positives),
            (0, 0, 0),
            "{name} {view:?} {:?}",
            s.first_wrong
        );
        assert!(s.coverage >= least, "{name} {view:?} {}", s.coverage);
    });
}
