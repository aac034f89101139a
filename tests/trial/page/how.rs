//! How to check the page and the trial, and what is not independent in it.

use maud::{Markup, html};

use super::summary::confinement;
use crate::Proof;

pub(super) fn section(proof: &Proof) -> Markup {
    html! {
        section {
            h2 { "How to check this" }
            ol {
                li { code { "kinoise prove --check DIR" } ", DIR the folder of this page: compares every hash, opens every seal again with its salt, \
                    judges every verdict again, scores again, applies the rule by which advised views were taken, and makes a sample of the recordings again from the seed; with "
                    code { "--all" } " every one of them" @if proof.order.real { ", for which " code { "--data" } " must name the real recordings" } ". It never reads this page." }
                li { "Hold the trial again: " code { "kinoise prove -o OTHER --sets " (proof.order.sets) " --seed " (proof.order.seed)
                    @if proof.order.real { " --data RECORDINGS" } } ". The same build gives the same recordings and the same verdicts." }
                li { "Hold one with a seed of your own. Nobody can have prepared for that one." }
                li { code { "kinoise prove --page DIR" } " draws this page again from DIR/proof.json; every figure on it is in that file or counted from its sets." }
            }
            (hashes(proof))
            (honesty(proof))
        }
    }
}

fn hashes(proof: &Proof) -> Markup {
    let seal = &proof.seal;
    let none = String::new();
    let second = proof.second.as_ref();
    let (advice, again) = second.map_or((&none, &none), |s| (&s.advice_sha256, &s.verdicts_sha256));
    let rows = [
        ("seal.json, before the first diagnosis", &proof.seal_sha256),
        ("verdicts.json, before the seals were opened", &proof.verdicts_sha256),
        ("advice.json, before the advised views were diagnosed", advice),
        ("verdicts-advised.json, before the seals were opened", again),
        ("the program that diagnosed", &seal.binary_sha256),
        ("the judge’s source text", &seal.judge_sha256),
        ("the seed", &seal.seed_sha256),
    ];
    html! {
        h3 { "SHA-256" }
        dl.hashes { @for (what, hash) in rows.into_iter().filter(|r| !r.1.is_empty()) { div { dt { (what) } dd { code { (hash) } } } } }
        dl.hashes {
            div { dt { "seed of the trial" } dd { (proof.order.seed) } }
            div { dt { "seed of every diagnosis" } dd { (seal.solver_seed) } }
            div { dt { "longest time for one" } dd { (seal.limit_s) " s" } }
            div { dt { "solver shut in by" } dd { (confinement(proof)) } }
            div { dt { "made by" } dd { (proof.provenance.tool) " " (proof.provenance.version) ", " (proof.provenance.created) } }
        }
        p.note { "The hash of each recording and of each sealed answer is in seal.json and in proof.json, under the set’s name." }
    }
}

fn honesty(proof: &Proof) -> Markup {
    html! {
        h3 { "What the trial’s worlds share with the tool" }
        ul {
            li { b { "S1, rays and disparity: " } "the geometry of a plane, two cameras and a disparity, as in any textbook. It uses neither the tool’s \
                catalogue of effects nor its diagnosis, and other formulas for the same causes; but who wrote it knew the catalogue." }
            li { b { "S2, light: " } "no formula of an error at all. Dots are projected, seen and matched by blocks, with the tool’s own optical simulator; a hidden cause is a \
                switch in the optics or in the matcher, and the answer is which switch. Its strengths are sizes in three steps, not nats." }
            li { b { "S3, real recordings: " } @if proof.order.real {
                "what a real sensor took. It is the one world whose truth comes from what is on trial: the term that is struck out is one that the tool \
                 itself had found in the whole recording, and what is transplanted is a cause of S1."
            } @else { b { "not part of this trial" } ", which was held without real recordings." } }
        }
        h3 { "What a sceptic should still doubt" }
        ul {
            li { "Whoever holds a trial can know its seed, and hold several and show one. Against that helps only a trial of your own." }
            li { "Where the line on confinement says “not”, the solver could have read the answers from memory of other processes or from disk; its source says that it does not." }
            li { "Sets of one kind share their maker: 40 sets of one cause are not 40 sensors." }
        }
    }
}
