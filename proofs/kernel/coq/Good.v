(** Certificates of what Claims.v states of good values. *)

Require Import Reals QArith Qreals List Bool PArith ZArith Lra Lia FMapPositive Classical.
Require Import Spec Claims States Closed Kernel Checker Orders Certificate.
Import ListNotations.
Open Scope R_scope.

Record certificate := {
  example : list Q;                          (* values inside of the region *)
  within : list (list (positive * Q));       (* for each side of the declared bounds, multiples of the sides of the region *)
  schedule : placement;
  checked : proofs
}.

Definition valued (l : list Q) : nat -> R := fun i => Q2R (nth i l 0%Q).

(** Whether a point is inside. *)
Definition at_point (l : list Q) (region : list (expr * bool)) : bool :=
  let value := fun x => match x with VPar i => nth i l 0%Q | _ => 0%Q end in
  forallb (fun f => sure (snd f) (fold_right (fun x q => Qred (snd x * value (fst x) + q)) (fst (fst f)) (snd (fst f))))
    (region_facts region).

Lemma at_point_inside l region : at_point l region = true -> inside (valued l) region.
Proof.
  intros H e s I. unfold at_point in H. rewrite forallb_forall in H.
  assert (J : In (fixed e, s) (region_facts region)) by (apply in_map_iff; exists (e, s); auto).
  apply H in J. cbn [fst snd] in J. apply sure_true in J.
  rewrite <- (fixed_at (fun x => match x with VPar i => valued l i | _ => 0 end) (valued l)) by auto.
  assert (E : forall c m, Q2R (fold_right (fun x q => Qred (snd x * match fst x with VPar i => nth i l 0%Q | _ => 0%Q end + q))
      c m) = Q2R c + terms_at (fun x => match x with VPar i => valued l i | _ => 0 end) m).
  { intros c m. induction m as [|[x q] m IH]; unfold terms_at in *; simpl; [lra|].
    rewrite Q2R_red, Q2R_plus, Q2R_mult, IH. simpl. destruct x; unfold valued; rewrite ?zero_R; lra. }
  rewrite E in J. exact J.
Qed.

Definition check (P : plan) (epsilon : Q) (declared region : list (expr * bool)) (c : certificate) : bool :=
  at_point (example c) region &&
  all2 (fun side => implied (table (region_facts region)) (snd side) (fixed (fst side))) declared (within c) &&
  scheduled P region (schedule c) && none_breaks P epsilon region [] (checked c).

Lemma inside_within region declared l g :
  all2 (fun side => implied (table (region_facts region)) (snd side) (fixed (fst side))) declared l = true ->
  inside g region -> inside g declared.
Proof.
  intros W G e s I. destruct (all2_in _ _ _ _ W I) as [ms [_ H]]. cbn [fst snd] in H.
  pose (v := fun x => match x with VPar i => g i | _ => 0 end).
  apply (implied_true v) in H; [now rewrite (fixed_at v g) in H by auto|].
  apply table_holds. intros f. apply (region_facts_hold v g); auto.
Qed.

Theorem check_sound P epsilon declared region c : check P epsilon declared region c = true ->
  good P epsilon declared region.
Proof.
  unfold check. rewrite !andb_true_iff. intros [[[A W] S] N]. split; [|split].
  - eexists. eapply at_point_inside; eauto.
  - intros g. eapply inside_within; eauto.
  - intros g G. split.
    + eexists. eapply scheduled_kept; eauto.
    + intros t K. now apply (none_breaks_safe P epsilon region [] (checked c)).
Qed.
