(** Certificates of the whole envelope: polyhedra of bad values, and that all others within the declared bounds are good. *)

Require Import Reals QArith Qreals List Bool PArith ZArith Lra Lia FMapPositive Classical.
Require Import Spec Claims States Closed Kernel Checker Orders Certificate Bad Good.
Import ListNotations.
Open Scope R_scope.

Definition region := list (expr * bool).

Record envelope_certificate := {
  removed : list (region * reason);
  others : proofs;                            (* that elsewhere nothing is broken *)
  pieces : list (region * placement);         (* schedules, piece by piece *)
  cover : option refutation                   (* that the pieces and what is removed are everything; None: not claimed *)
}.

(** What is known of values in no removed polyhedron: the negation of those with one side, and of all as formulas. *)
Definition beyond_sides (declared : region) (removed : list region) : region :=
  declared ++ flat_map (fun piece => match piece with [side] => [other_side side] | _ => [] end) removed.

Definition inside_form (piece : region) : form := fall (map (fun side => FCmp (snd side) (fixed (fst side))) piece).
Definition outside (l : list region) : list form := map (fun piece => FNot (inside_form piece)) l.

Definition check_envelope (P : plan) (epsilon : Q) (declared : region) (c : envelope_certificate) : bool :=
  let polyhedra := map fst (removed c) in
  let good := beyond_sides declared polyhedra in
  forallb (fun x => check_bad P epsilon (fst x ++ declared) (snd x)) (removed c) &&
  none_breaks P epsilon good (outside polyhedra) (others c) &&
  match cover c with
  | None => true
  | Some r =>
      forallb (fun x => scheduled P (fst x ++ good) (snd x)) (pieces c) &&
      refuted (table (region_facts good)) (M.empty (M.t Q)) Anywhere FTrue
        (fun _ => outside polyhedra ++ outside (map fst (pieces c))) (Some r)
  end.

Definition if_scheduled (c : envelope_certificate) : bool := match cover c with None => true | Some _ => false end.

Lemma inside_app g l m : inside g (l ++ m) <-> inside g l /\ inside g m.
Proof.
  unfold inside. split.
  - intros H. split; intros e s I; apply H, in_app_iff; auto.
  - intros [A B] e s I. apply in_app_iff in I as [I|I]; auto.
Qed.

Lemma inside_form_true v g piece : (forall i, v (VPar i) = g i) -> (fval v (inside_form piece) <-> inside g piece).
Proof.
  intros G. unfold inside_form. rewrite fval_all. split.
  - intros H e s I. rewrite <- (fixed_at v g) by auto. apply (H (FCmp s (fixed e))). apply in_map_iff. now exists (e, s).
  - intros H f I. apply in_map_iff in I as [[e s] [<- I]]. cbn [fval fst snd]. rewrite (fixed_at v g) by auto. now apply H.
Qed.

Lemma outside_true v g l : (forall i, v (VPar i) = g i) -> (forall piece, In piece l -> ~ inside g piece) ->
  forall f, In f (outside l) -> fval v f.
Proof.
  intros G O f I. apply in_map_iff in I as [piece [<- I]]. cbn [fval]. rewrite (inside_form_true v g) by auto. now apply O.
Qed.

Lemma beyond_all_inside g declared l : inside g declared -> (forall piece, In piece l -> ~ inside g piece) ->
  inside g (beyond_sides declared l).
Proof.
  intros D O. apply inside_app. split; auto. intros e s I. apply in_flat_map in I as [piece [I J]].
  destruct piece as [|side [|? ?]]; try easy. revert e s J. now apply other_side_inside, O.
Qed.

Theorem check_envelope_sound P epsilon declared c : check_envelope P epsilon declared c = true ->
  envelope P epsilon declared (map fst (removed c)) (if_scheduled c).
Proof.
  unfold check_envelope. rewrite !andb_true_iff. intros [[B N] S] g D K. split.
  - intros V piece I G. apply in_map_iff in I as [[piece' r] [E I]]. cbn [fst] in E. subst piece'.
    rewrite forallb_forall in B. apply B in I. cbn [fst snd] in I.
    apply (check_bad_sound P epsilon _ g) in I; auto. apply inside_app. auto.
  - intros O. pose proof (beyond_all_inside g declared _ D O) as G. split.
    + unfold if_scheduled in K. destruct (cover c) as [r|]; [|auto]. apply andb_true_iff in S as [S R].
      apply NNPP. intros X. refine (refuted_false P g (fun _ => 0) 0 _ _ _ _ _ _ R _ _ _ _ _).
      * apply table_holds. intros f. now apply (region_facts_hold _ g).
      * intros x y k. unfold bound. now rewrite M.gempty.
      * exact Logic.I.
      * exact Logic.I.
      * intros f I. apply in_app_iff in I as [I|I].
        -- revert f I. now apply (outside_true _ g).
        -- revert f I. apply (outside_true _ g); auto. intros piece I Y. apply in_map_iff in I as [[piece' s] [E I]].
           cbn [fst] in E. subst. rewrite forallb_forall in S. apply S in I. apply X. eexists.
           eapply scheduled_kept; eauto. apply inside_app. auto.
    + intros t T. apply (none_breaks_safe P epsilon _ _ _ g t N G T). intros time. now apply (outside_true _ g).
Qed.
